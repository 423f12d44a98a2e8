"""The frame around the tabs: window, header, menus, STOP, settings, and what the tabs share."""
