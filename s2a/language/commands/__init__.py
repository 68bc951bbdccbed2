"""Commands of this room, which the command line finds by their files."""
