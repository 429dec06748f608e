"""The studies' fixtures and the writing of the report: all of it is `validation.harness.plugin`."""

from validation.harness.plugin import *  # noqa: F403
