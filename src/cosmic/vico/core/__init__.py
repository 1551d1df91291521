"""What ViCo does with pictures: acquiring, keeping, measuring."""
