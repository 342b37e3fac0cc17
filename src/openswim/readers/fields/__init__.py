"""Physics that readers share: air, particles, cloud cover, and what stands in where a file is silent."""
