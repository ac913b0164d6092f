-- Schema 3. Scenes remember how they were to be read.
ALTER TABLE scenes ADD COLUMN options TEXT NOT NULL DEFAULT '{}';
