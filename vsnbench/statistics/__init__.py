"""All inference, a file a subject, from numpy and scipy; nothing of the record."""
