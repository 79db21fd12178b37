/* An example: a FreeRTOS task that runs the controller behind its guard once a period. Create it
   with xTaskCreate, with a stack as README.md tells; the two functions below are yours. */
#include "controller_guard.h"

#include <FreeRTOS.h>
#include <task.h>

#define PERIOD_MS (@PERIOD_MS@u) /* @PERIOD@ s */

/* Fills in the measurements of now, and what the sensors say of themselves. */
void read_sensors(controller_input *in, controller_validity *valid);

/* Takes commands and status (a sum of CONTROLLER_STATUS_...). */
void write_commands(const controller_output *out, uint32_t status);

void controller_task(void *unused);

static controller_guard guard;

void controller_task(void *unused)
{
  controller_input in = {0};
  controller_validity valid = {0};
  controller_output out;
  TickType_t woken = xTaskGetTickCount();
  uint32_t number = 0u;
@BEGIN@
  (void)unused;
  controller_guard_init(@ATTITUDE@&guard);
  for (;;) {
    read_sensors(&in, &valid);
    in.sample = (int32_t)number; /* counts periods, and may wrap around */
    write_commands(&out, controller_guard_step(&controller_default_parameters,
                                               &controller_default_guard_parameters, &in, &valid,
                                               &guard, &out));
    number++;
    vTaskDelayUntil(&woken, pdMS_TO_TICKS(PERIOD_MS));
  }
}
