// What Python sees of the compiled core. The build runs this through the C preprocessor (with
// BT_CDEF defined and empty standard headers) and gives the outcome to cffi, so that no declaration
// is written twice.
#ifndef BIOTAC_BINDING_H
#define BIOTAC_BINDING_H

#include "batch.h"
#include "blocks.h"
#include "bounds.h"
#include "cobs.h"
#include "crc32.h"
#include "decode.h"
#include "descriptor.h"
#include "device.h"
#include "finger.h"
#include "framing.h"
#include "intake.h"
#include "kernel.h"
#include "lin2013.h"
#include "map.h"
#include "numbering.h"
#include "record.h"
#include "replay.h"
#include "sbc.h"
#include "tape.h"
#include "tare.h"
#include "variant_errors.h"

// Compared with host/biotac/_wire.py when the module is imported.
uint32_t bt_binding_schema_hash(void);

#endif
