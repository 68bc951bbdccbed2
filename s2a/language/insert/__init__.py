"""A language model adds objects to a room: what it proposes is checked, confined and compared before anything is written."""
