"""Tables of the campaign file that describe an inertial navigation."""
