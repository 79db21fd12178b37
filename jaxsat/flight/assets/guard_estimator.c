static void substitute(const controller_input *in, const controller_validity *valid,
                       const controller_guard_parameters *limits, uint32_t status,
                       controller_guard *guard, controller_input *checked)
{
  if ((status & CONTROLLER_STATUS_INVALID_RATE) != 0u) {
    (void)memcpy(checked->rate, guard->rate, sizeof(guard->rate));
  } else {
    (void)memcpy(guard->rate, in->rate, sizeof(guard->rate));
  }
@MISSING@
}

static bool has_begun(const controller_parameters *p,
                      const controller_guard_parameters *limits, controller_guard *guard,
                      const controller_input *checked, controller_state *after)
{
  bool begins;

@MEASURED@  begins = is_unit(guard->attitude, limits->norm_tolerance);
  if (begins) {
    controller_init(p, guard->attitude, checked, after);
  }
  return begins;
}

static void coast(const controller_parameters *p, const controller_input *checked,
                  controller_guard *guard)
{
  controller_state after = guard->state;

  controller_coast(p, checked, &after);
  if (is_usable_state(&after)) {
    guard->state = after;
  }
}

