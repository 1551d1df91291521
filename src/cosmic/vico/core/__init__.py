"""What ViCo does with images: acquiring, keeping, measuring."""
