"""What every subsystem shares and knows none of them (CoSMic-Frame, thesis 5.3)."""
