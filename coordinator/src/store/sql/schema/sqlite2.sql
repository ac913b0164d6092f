-- Schema 2. Tasks that storage failed under wait until `due` and say why; chunks know what their tiles cost, so that they can be lost again.
ALTER TABLE tasks ADD COLUMN due INTEGER NOT NULL DEFAULT 0;
ALTER TABLE tasks ADD COLUMN put_off INTEGER NOT NULL DEFAULT 0;
ALTER TABLE tasks ADD COLUMN why TEXT;
ALTER TABLE chunks ADD COLUMN cost INTEGER NOT NULL DEFAULT 0;
