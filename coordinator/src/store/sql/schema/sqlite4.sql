-- Schema 4. Failures: tiles that are suspected, charged, quarantined; workers that are barred; what becomes of a job with such a tile.
ALTER TABLE shards ADD COLUMN quarantined TEXT NOT NULL DEFAULT '';
ALTER TABLE shards ADD COLUMN twinned TEXT NOT NULL DEFAULT '';
ALTER TABLE shards ADD COLUMN ceilings TEXT NOT NULL DEFAULT '';
ALTER TABLE shards ADD COLUMN charges TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN on_poison TEXT NOT NULL DEFAULT 'fail';
ALTER TABLE jobs ADD COLUMN places TEXT NOT NULL DEFAULT '[]';
ALTER TABLE workers ADD COLUMN refuted TEXT NOT NULL DEFAULT '';
ALTER TABLE workers ADD COLUMN barred TEXT;
CREATE INDEX attempts_by_place ON attempts (job, phase, first) WHERE state = 'held';
