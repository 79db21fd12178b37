#ifndef CONTROLLER_H
#define CONTROLLER_H

#include <stdbool.h>
#include <stdint.h>

@MODES@@STRUCTURES@
/* The scenario's numbers. */
extern const controller_parameters controller_default_parameters;

@ABOUT_INIT@
void controller_init(const controller_parameters *p, @ATTITUDE@const controller_input *in,
                     controller_state *state);

/* One sample: reads the measurement, writes the commands and the next state. The sample's
   number may begin anywhere: time and samples count from controller_init. */
void controller_step(const controller_parameters *p, const controller_input *in,
                     controller_state *state, controller_output *out);

@COAST@#endif /* CONTROLLER_H */
