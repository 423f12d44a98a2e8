"""What the motor is told: motions, units, limits and the state machine. It knows no device."""
