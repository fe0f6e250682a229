"""What every package stands on: the errors a user can mend, TOML files, and the files that are shipped."""
