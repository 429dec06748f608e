"""A scene compared by every method, each design judged by the fine reference: `compare` and its page."""
