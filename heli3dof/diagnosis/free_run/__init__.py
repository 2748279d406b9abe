"""The diagnosis of logs without a likelihood, by free-run predictions."""
