-- Schema 1 of PostgreSQL: SQLite's schemas 1 to 5. Ids and hashes are text, times are milliseconds since 1970 by the database's clock, sets of
-- tiles are text such as "0-12,14". Tables that every chunk or lease touches have no foreign keys: each would lock the job's row.
CREATE TABLE scenes (
    id         TEXT COLLATE "C" PRIMARY KEY,
    hash       TEXT COLLATE "C",
    state      TEXT NOT NULL,
    created    BIGINT NOT NULL,
    files      TEXT NOT NULL,
    canonical  TEXT,
    statistics TEXT,
    warnings   TEXT NOT NULL DEFAULT '[]',
    problems   TEXT NOT NULL DEFAULT '[]',
    options    TEXT NOT NULL DEFAULT '{}',
    owner      TEXT COLLATE "C"
);
CREATE INDEX scenes_by_hash ON scenes (hash, id);

CREATE TABLE jobs (
    id           TEXT COLLATE "C" PRIMARY KEY,
    scene        TEXT COLLATE "C" NOT NULL REFERENCES scenes (id),
    scene_hash   TEXT,
    public       TEXT NOT NULL,
    state        TEXT NOT NULL,
    settings     TEXT NOT NULL,
    priority     BIGINT NOT NULL,
    labels       TEXT NOT NULL,
    bake_version BIGINT NOT NULL,
    plan         TEXT,
    plan_blob    TEXT,
    tiles        BIGINT NOT NULL DEFAULT 0,
    tiles_done   BIGINT NOT NULL DEFAULT 0,
    cost         BIGINT NOT NULL DEFAULT 0,
    cost_done    BIGINT NOT NULL DEFAULT 0,
    texels       BIGINT NOT NULL DEFAULT 0,
    rays         BIGINT NOT NULL DEFAULT 0,
    created      BIGINT NOT NULL,
    marks        TEXT NOT NULL,
    seq          BIGINT NOT NULL DEFAULT 0,
    on_poison    TEXT NOT NULL DEFAULT 'fail',
    places       TEXT NOT NULL DEFAULT '[]',
    owner        TEXT COLLATE "C"
) WITH (fillfactor = 50); -- Room beside each row for its next version: it changes with every chunk.
CREATE INDEX jobs_by_scene ON jobs (scene, public);
CREATE INDEX jobs_by_owner ON jobs (owner, id) WHERE owner IS NOT NULL;
CREATE INDEX jobs_baking ON jobs (id) WHERE public = 'baking';

-- Every plan that a job has or had: results of a phase make a new one while workers may still ask for the old one.
CREATE TABLE plans (
    digest TEXT COLLATE "C" NOT NULL,
    job    TEXT COLLATE "C" NOT NULL REFERENCES jobs (id),
    blob   TEXT COLLATE "C" NOT NULL,
    PRIMARY KEY (digest, job)
);
CREATE INDEX plans_by_blob ON plans (blob);

-- Consecutive tiles of a phase: what waits and what is done. What is neither is leased.
CREATE TABLE shards (
    job     TEXT COLLATE "C" NOT NULL,
    phase   TEXT COLLATE "C" NOT NULL,
    shard   BIGINT NOT NULL,
    pending TEXT NOT NULL,
    done    TEXT NOT NULL,
    waiting BIGINT NOT NULL,
    quarantined TEXT NOT NULL DEFAULT '',
    twinned     TEXT NOT NULL DEFAULT '',
    ceilings    TEXT NOT NULL DEFAULT '',
    charges     TEXT NOT NULL DEFAULT '',
    PRIMARY KEY (job, phase, shard)
) WITH (fillfactor = 50);
CREATE INDEX shards_waiting ON shards (job, phase, shard) WHERE waiting > 0;

CREATE TABLE attempts (
    token     TEXT COLLATE "C" PRIMARY KEY,
    worker    TEXT COLLATE "C" NOT NULL,
    job       TEXT COLLATE "C" NOT NULL,
    phase     TEXT NOT NULL,
    first     BIGINT NOT NULL,
    past      BIGINT NOT NULL,
    state     TEXT NOT NULL,
    remaining TEXT NOT NULL,
    granted   BIGINT NOT NULL,
    deadline  BIGINT NOT NULL,
    cap       BIGINT NOT NULL,
    ended     BIGINT,
    texels    BIGINT NOT NULL DEFAULT 0,
    rays      BIGINT NOT NULL DEFAULT 0
) WITH (fillfactor = 70);
-- Not by deadline: a heartbeat that changed an indexed column would write every index of the table.
CREATE INDEX attempts_held ON attempts (job, phase, first) WHERE state = 'held';
CREATE INDEX attempts_by_worker ON attempts (worker) WHERE state = 'held';
CREATE INDEX attempts_by_job ON attempts (job);
CREATE INDEX attempts_ended ON attempts (ended) WHERE ended IS NOT NULL;

CREATE TABLE chunks (
    token      TEXT COLLATE "C" NOT NULL,
    n          BIGINT NOT NULL,
    job        TEXT COLLATE "C" NOT NULL,
    phase      TEXT COLLATE "C" NOT NULL,
    blob       TEXT COLLATE "C" NOT NULL,
    trailer_at BIGINT NOT NULL,
    length     BIGINT NOT NULL,
    first      BIGINT NOT NULL,
    last       BIGINT NOT NULL,
    accepted   TEXT NOT NULL,
    conflicts  TEXT NOT NULL,
    cost       BIGINT NOT NULL,
    PRIMARY KEY (token, n)
);
CREATE INDEX chunks_by_tile ON chunks (job, phase, first) WHERE accepted <> '';
CREATE INDEX chunks_by_blob ON chunks (blob);

CREATE TABLE tasks (
    id       BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    job      TEXT COLLATE "C",
    task     TEXT NOT NULL,
    token    TEXT COLLATE "C" UNIQUE,
    deadline BIGINT,
    tries    BIGINT NOT NULL DEFAULT 0,
    due      BIGINT NOT NULL DEFAULT 0,
    put_off  BIGINT NOT NULL DEFAULT 0,
    why      TEXT
);
CREATE INDEX tasks_by_job ON tasks (job);

CREATE TABLE reports (
    job     TEXT COLLATE "C" NOT NULL REFERENCES jobs (id),
    surface BIGINT NOT NULL,
    report  TEXT NOT NULL,
    PRIMARY KEY (job, surface)
);

CREATE TABLE package_files (
    job        TEXT COLLATE "C" NOT NULL REFERENCES jobs (id),
    path       TEXT COLLATE "C" NOT NULL,
    media_type TEXT NOT NULL,
    bytes      BIGINT NOT NULL,
    sha256     TEXT NOT NULL,
    blob       TEXT COLLATE "C" NOT NULL,
    PRIMARY KEY (job, path)
);
CREATE INDEX package_files_by_blob ON package_files (blob);

CREATE TABLE events (
    job  TEXT COLLATE "C" NOT NULL,
    seq  BIGINT NOT NULL,
    at   BIGINT NOT NULL,
    kind TEXT NOT NULL,
    PRIMARY KEY (job, seq)
);

CREATE TABLE workers (
    id           TEXT COLLATE "C" PRIMARY KEY,
    name         TEXT NOT NULL,
    threads      BIGINT NOT NULL,
    features     TEXT NOT NULL,
    bake_version BIGINT NOT NULL,
    since        BIGINT NOT NULL,
    seen         BIGINT NOT NULL,
    texels       BIGINT NOT NULL DEFAULT 0,
    rays         BIGINT NOT NULL DEFAULT 0,
    core_seconds DOUBLE PRECISION NOT NULL DEFAULT 0,
    peak_rss     BIGINT NOT NULL DEFAULT 0,
    refuted      TEXT NOT NULL DEFAULT '',
    barred       TEXT
);

CREATE TABLE contributions (
    job          TEXT COLLATE "C" NOT NULL,
    phase        TEXT NOT NULL,
    worker       TEXT COLLATE "C" NOT NULL,
    name         TEXT NOT NULL,
    attempts     BIGINT NOT NULL,
    texels       BIGINT NOT NULL,
    rays         BIGINT NOT NULL,
    core_seconds DOUBLE PRECISION NOT NULL,
    peak_rss     BIGINT NOT NULL,
    PRIMARY KEY (job, phase, worker)
);

-- Access: tokens (hashes only; nothing is ever deleted) and the secret of the service.
CREATE TABLE tokens (
    id      TEXT COLLATE "C" PRIMARY KEY,
    name    TEXT NOT NULL,
    roles   TEXT NOT NULL,
    hash    TEXT NOT NULL,
    created BIGINT NOT NULL,
    used    BIGINT,
    expires BIGINT,
    revoked BIGINT
);

CREATE TABLE secrets (
    name  TEXT COLLATE "C" PRIMARY KEY,
    value TEXT NOT NULL
);
