"""What a campaign flies: systems with named errors going in and named errors coming out."""
