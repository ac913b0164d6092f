-- Schema 3, SQLite's schema 7. Requests that may be repeated: what was answered to an Idempotency-Key of an owner ('' where nobody asked for tokens), or who is
-- about to answer it and until when. Webhooks: whom to tell of the end of a job, and the tasks that tell it, which have a lane of their own.
CREATE TABLE requests (
    owner    TEXT COLLATE "C" NOT NULL,
    key      TEXT COLLATE "C" NOT NULL,
    print    TEXT COLLATE "C" NOT NULL,
    subject  TEXT COLLATE "C" NOT NULL,
    claim    TEXT COLLATE "C" UNIQUE,
    deadline BIGINT,
    began    BIGINT NOT NULL,
    answer   TEXT,
    PRIMARY KEY (owner, key)
);
CREATE INDEX requests_by_age ON requests (began);

ALTER TABLE jobs ADD COLUMN webhook TEXT;
ALTER TABLE tasks ADD COLUMN notice BIGINT NOT NULL DEFAULT 0;
