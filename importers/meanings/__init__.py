"""Messages without a meaning of their own type: by mappings of the configuration, by what is known of drivers, and drafts of
mappings for the rest. Uses drivers; a type whose messages are no rows each is converted by a file here.
"""
