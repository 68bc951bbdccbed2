"""Language models: a client for any endpoint, recorded answers, a rule-based fallback."""
