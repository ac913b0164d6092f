-- Schema 1. Ids and hashes are text, times are milliseconds since 1970, sets of tiles are text such as "0-12,14".
CREATE TABLE scenes (
    id         TEXT PRIMARY KEY,
    hash       TEXT,
    state      TEXT NOT NULL,
    created    INTEGER NOT NULL,
    files      TEXT NOT NULL,
    canonical  TEXT,
    statistics TEXT,
    warnings   TEXT NOT NULL DEFAULT '[]',
    problems   TEXT NOT NULL DEFAULT '[]'
) STRICT;
CREATE INDEX scenes_by_hash ON scenes (hash, id);

CREATE TABLE jobs (
    id           TEXT PRIMARY KEY,
    scene        TEXT NOT NULL REFERENCES scenes (id),
    scene_hash   TEXT,
    public       TEXT NOT NULL,
    state        TEXT NOT NULL,
    settings     TEXT NOT NULL,
    priority     INTEGER NOT NULL,
    labels       TEXT NOT NULL,
    bake_version INTEGER NOT NULL,
    plan         TEXT,
    plan_blob    TEXT,
    tiles        INTEGER NOT NULL DEFAULT 0,
    tiles_done   INTEGER NOT NULL DEFAULT 0,
    cost         INTEGER NOT NULL DEFAULT 0,
    cost_done    INTEGER NOT NULL DEFAULT 0,
    texels       INTEGER NOT NULL DEFAULT 0,
    rays         INTEGER NOT NULL DEFAULT 0,
    created      INTEGER NOT NULL,
    marks        TEXT NOT NULL,
    seq          INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE INDEX jobs_by_scene ON jobs (scene, public);

-- Every plan that a job has or had: results of a phase make a new one while workers may still ask for the old one.
CREATE TABLE plans (
    digest TEXT NOT NULL,
    job    TEXT NOT NULL REFERENCES jobs (id),
    blob   TEXT NOT NULL,
    PRIMARY KEY (digest, job)
) STRICT, WITHOUT ROWID;

-- Consecutive tiles of a phase: what waits and what is done. What is neither is leased.
CREATE TABLE shards (
    job     TEXT NOT NULL REFERENCES jobs (id),
    phase   TEXT NOT NULL,
    shard   INTEGER NOT NULL,
    pending TEXT NOT NULL,
    done    TEXT NOT NULL,
    waiting INTEGER NOT NULL,
    PRIMARY KEY (job, phase, shard)
) STRICT, WITHOUT ROWID;
CREATE INDEX shards_waiting ON shards (job, phase, shard) WHERE waiting > 0;

CREATE TABLE attempts (
    token     TEXT PRIMARY KEY,
    worker    TEXT NOT NULL,
    job       TEXT NOT NULL REFERENCES jobs (id),
    phase     TEXT NOT NULL,
    first     INTEGER NOT NULL,
    past      INTEGER NOT NULL,
    state     TEXT NOT NULL,
    remaining TEXT NOT NULL,
    granted   INTEGER NOT NULL,
    deadline  INTEGER NOT NULL,
    cap       INTEGER NOT NULL,
    ended     INTEGER,
    texels    INTEGER NOT NULL DEFAULT 0,
    rays      INTEGER NOT NULL DEFAULT 0
) STRICT, WITHOUT ROWID;
CREATE INDEX attempts_held ON attempts (deadline) WHERE state = 'held';
CREATE INDEX attempts_by_job ON attempts (job);
CREATE INDEX attempts_ended ON attempts (ended) WHERE ended IS NOT NULL;

CREATE TABLE chunks (
    token      TEXT NOT NULL,
    n          INTEGER NOT NULL,
    job        TEXT NOT NULL REFERENCES jobs (id),
    phase      TEXT NOT NULL,
    blob       TEXT NOT NULL,
    trailer_at INTEGER NOT NULL,
    length     INTEGER NOT NULL,
    first      INTEGER NOT NULL,
    last       INTEGER NOT NULL,
    accepted   TEXT NOT NULL,
    conflicts  TEXT NOT NULL,
    PRIMARY KEY (token, n)
) STRICT, WITHOUT ROWID;
CREATE INDEX chunks_by_tile ON chunks (job, phase, first) WHERE accepted <> '';
CREATE INDEX chunks_by_blob ON chunks (blob);

CREATE TABLE tasks (
    id       INTEGER PRIMARY KEY,
    job      TEXT,
    task     TEXT NOT NULL,
    token    TEXT UNIQUE,
    deadline INTEGER,
    tries    INTEGER NOT NULL DEFAULT 0
) STRICT;
CREATE INDEX tasks_by_job ON tasks (job);

CREATE TABLE reports (
    job     TEXT NOT NULL REFERENCES jobs (id),
    surface INTEGER NOT NULL,
    report  TEXT NOT NULL,
    PRIMARY KEY (job, surface)
) STRICT, WITHOUT ROWID;

CREATE TABLE package_files (
    job        TEXT NOT NULL REFERENCES jobs (id),
    path       TEXT NOT NULL,
    media_type TEXT NOT NULL,
    bytes      INTEGER NOT NULL,
    sha256     TEXT NOT NULL,
    blob       TEXT NOT NULL,
    PRIMARY KEY (job, path)
) STRICT, WITHOUT ROWID;
CREATE INDEX package_files_by_blob ON package_files (blob);

CREATE TABLE events (
    job  TEXT NOT NULL REFERENCES jobs (id),
    seq  INTEGER NOT NULL,
    at   INTEGER NOT NULL,
    kind TEXT NOT NULL,
    PRIMARY KEY (job, seq)
) STRICT, WITHOUT ROWID;

CREATE TABLE workers (
    id           TEXT PRIMARY KEY,
    name         TEXT NOT NULL,
    threads      INTEGER NOT NULL,
    features     TEXT NOT NULL,
    bake_version INTEGER NOT NULL,
    since        INTEGER NOT NULL,
    seen         INTEGER NOT NULL,
    texels       INTEGER NOT NULL DEFAULT 0,
    rays         INTEGER NOT NULL DEFAULT 0,
    core_seconds REAL NOT NULL DEFAULT 0,
    peak_rss     INTEGER NOT NULL DEFAULT 0
) STRICT, WITHOUT ROWID;

CREATE TABLE contributions (
    job          TEXT NOT NULL REFERENCES jobs (id),
    phase        TEXT NOT NULL,
    worker       TEXT NOT NULL,
    name         TEXT NOT NULL,
    attempts     INTEGER NOT NULL,
    texels       INTEGER NOT NULL,
    rays         INTEGER NOT NULL,
    core_seconds REAL NOT NULL,
    peak_rss     INTEGER NOT NULL,
    PRIMARY KEY (job, phase, worker)
) STRICT, WITHOUT ROWID;
