"""The part of a domain that a view needs, what lies beyond it, and domains nested in each other."""
