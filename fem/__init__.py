"""The prestretched hyperelastic membrane under plate load and voltage."""
