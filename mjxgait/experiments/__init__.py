"""Many runs, a table and a picture: ablations, repertoires, several seeds."""
