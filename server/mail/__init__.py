"""Recordings by mail: composed on the disk, kept in an outbox that survives a kill, sent by SMTP."""
