"""Effects that a user adds: write the files of a plug-in, and check an effect's file."""
