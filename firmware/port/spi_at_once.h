// port_spi_begin16 and port_spi_end16 for ports whose exchanges are over when they return. Include in one
// file.
#ifndef BIOTAC_SPI_AT_ONCE_H
#define BIOTAC_SPI_AT_ONCE_H

#include "port.h"

static uint16_t spi_miso;

bool port_spi_begin16(uint16_t mosi)
{
    spi_miso = port_spi_transfer16(mosi);
    return true;
}

uint16_t port_spi_end16(void)
{
    return spi_miso;
}

#endif
