// TOML file to Config.
