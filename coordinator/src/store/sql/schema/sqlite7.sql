-- Schema 7. Requests that may be repeated: what was answered to an Idempotency-Key of an owner ('' where nobody asked for tokens), or who is
-- about to answer it and until when. Webhooks: whom to tell of the end of a job, and the tasks that tell it, which have a lane of their own.
CREATE TABLE requests (
    owner    TEXT NOT NULL,
    key      TEXT NOT NULL,
    print    TEXT NOT NULL,
    subject  TEXT NOT NULL,
    claim    TEXT UNIQUE,
    deadline INTEGER,
    began    INTEGER NOT NULL,
    answer   TEXT,
    PRIMARY KEY (owner, key)
) STRICT, WITHOUT ROWID;
CREATE INDEX requests_by_age ON requests (began);

ALTER TABLE jobs ADD COLUMN webhook TEXT;
ALTER TABLE tasks ADD COLUMN notice INTEGER NOT NULL DEFAULT 0;
