"""YAML settings files with errors that name the field and the fix."""
