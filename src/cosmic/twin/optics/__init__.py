"""What cameras above the twin's plate see."""
