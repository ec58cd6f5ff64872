"""The navigator of type ``ins`` as an object that a closed loop steps."""
