"""All inference, a file a subject: numpy, scipy and, where it has the thing, statsmodels; nothing of the record."""
