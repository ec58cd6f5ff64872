"""Studies of many small campaigns: over start times, and over multiples of the stated errors."""
