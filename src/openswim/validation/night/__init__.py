"""Night and dusk against tables: how bright lights and skies are, where they stand, and whether nothing leaps."""
