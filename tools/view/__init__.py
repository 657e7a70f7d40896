"""The page of `gritd view`: the running daemon, or recordings, in a browser."""
