"""Running a locked study: arms, blinding, integrity."""
