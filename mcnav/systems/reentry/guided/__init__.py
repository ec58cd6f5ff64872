"""The guided reentry: a lift law fed with what the navigator indicates, so that the truth of each sample differs."""
