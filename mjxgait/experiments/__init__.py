"""Many runs, a table and a picture: ablations, repertoires, multi-seed runs."""
