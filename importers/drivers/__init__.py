"""What the usual drivers publish: a data file per package of messages, with definitions and meanings. A new driver is a file
here; the keys of a meaning are those of `importers.message_settings.MessageMapping`.
"""
