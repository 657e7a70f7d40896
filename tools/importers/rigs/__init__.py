"""One file a rig whose public data can be imported; `registry` finds them by being here."""
