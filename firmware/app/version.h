// Firmware release. The wire has another version, in protocol/link.toml.
#ifndef BIOTAC_VERSION_H
#define BIOTAC_VERSION_H

#define BT_VERSION_MAJOR 0
#define BT_VERSION_MINOR 1
#define BT_VERSION_PATCH 0

#endif
