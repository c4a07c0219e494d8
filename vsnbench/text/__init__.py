"""Text for terminals: sanitized output and spelling suggestions."""
