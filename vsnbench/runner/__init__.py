"""From a campaign to recorded and judged episodes."""
