"""Pages in the browser: one to give away, and one to watch an evolution with."""
