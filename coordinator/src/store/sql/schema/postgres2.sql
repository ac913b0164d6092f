-- Schema 2, SQLite's schema 6. Attempts know what they are for (tiles that wait, the twin of a late attempt, a check of another worker) and what
-- their tiles cost; shards which tiles are baked twice; chunks who brought them; jobs which share of their tiles is baked twice, and the secret that says
-- which.
ALTER TABLE attempts ADD COLUMN kind TEXT NOT NULL DEFAULT 'work';
ALTER TABLE attempts ADD COLUMN twin_of TEXT;
ALTER TABLE attempts ADD COLUMN cost BIGINT NOT NULL DEFAULT 0;
ALTER TABLE shards ADD COLUMN checks TEXT NOT NULL DEFAULT '';
ALTER TABLE shards ADD COLUMN unchecked BIGINT NOT NULL DEFAULT 0;
ALTER TABLE shards ADD COLUMN unasked BIGINT NOT NULL DEFAULT 0;
ALTER TABLE chunks ADD COLUMN worker TEXT NOT NULL DEFAULT '';
UPDATE chunks SET worker = COALESCE((SELECT worker FROM attempts WHERE attempts.token = chunks.token), '');
ALTER TABLE jobs ADD COLUMN verify DOUBLE PRECISION NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN secret TEXT NOT NULL DEFAULT '';
CREATE INDEX shards_unchecked ON shards (job, phase, shard) WHERE unchecked > 0;
