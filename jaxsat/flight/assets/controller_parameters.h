#ifndef CONTROLLER_PARAMETERS_H
#define CONTROLLER_PARAMETERS_H

#include "controller.h"

/* controller_parameter_checksum of the scenario's numbers. */
#define CONTROLLER_DEFAULT_CHECKSUM (0x@CHECKSUM@u)

/* The number of the first parameter, counted from 1 in the order of the structure, that has an
   element out of range or not a number; 0 if there is none. controller_parameters.c has the
   ranges. */
int32_t controller_check_parameters(const controller_parameters *p);

/* CRC-32/ISO-HDLC (reversed polynomial 0xEDB88320, begin and final exclusive or 0xFFFFFFFF) of
   all elements in order, as little-endian bytes without padding. */
uint32_t controller_parameter_checksum(const controller_parameters *p);

#endif /* CONTROLLER_PARAMETERS_H */
