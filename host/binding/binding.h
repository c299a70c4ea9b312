// The compiled core, as Python sees it. The build runs this through the C preprocessor (with BT_CDEF defined
// and empty standard headers) and gives the result to cffi, so that no declaration is written twice.
#ifndef BIOTAC_BINDING_H
#define BIOTAC_BINDING_H

#include "batch.h"
#include "bounds.h"
#include "compute.h"
#include "decode/decode.h"
#include "decode/descriptor.h"
#include "decode/intake.h"
#include "decode/numbering.h"
#include "device.h"
#include "finger.h"
#include "keep/calibration.h"
#include "keep/storage.h"
#include "lin2013.h"
#include "map/estimate.h"
#include "map/map.h"
#include "replay.h"
#include "sbc.h"
#include "signal/signals.h"
#include "sim_board.h"
#include "skin/contact.h"
#include "skin/deform.h"
#include "skin/effects.h"
#include "skin/read.h"
#include "skin/ringing.h"
#include "skin/skin.h"
#include "solve/interval.h"
#include "solve/solve.h"
#include "stream.h"
#include "touch/tare.h"
#include "units.h"
#include "wire/cobs.h"
#include "wire/crc32.h"
#include "wire/framing.h"

#endif
