"""The error-state Kalman filter: its states, its tables along the truth, the consistency of its samples."""
