"""Numbers of textbooks and public pages on inertial navigation and filters, computed again."""
