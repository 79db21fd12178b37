static uint32_t judged(const controller_input *in, const controller_validity *valid,
                       const controller_guard_parameters *limits)
{
  uint32_t status = 0u;

@JUDGEMENTS@
  return status;
}

static uint32_t counted(const controller_input *in, controller_guard *guard)
{
  const uint32_t passed = (uint32_t)in->sample - (uint32_t)guard->sample;
  const bool repeated = guard->called && ((passed == 0u) || (passed > 0x7FFFFFFFu));
  uint32_t status = 0u;

  if (repeated) {
    status = CONTROLLER_STATUS_REPEATED;
  } else {
    if (guard->called && (passed > 1u)) {
      status = CONTROLLER_STATUS_SKIPPED;
    }
    guard->sample = in->sample;
    guard->called = true;
  }
  return status;
}

static uint32_t finished(const controller_guard_parameters *limits, bool steps,
                         const controller_state *after, controller_guard *guard,
                         controller_output *out)
{
  uint32_t status = 0u;

  if (steps) {
    guard->begun = true;
    guard->state = *after;
    guard->last = *out;
    guard->missed = 0;
  } else {
    guard->without_step++;
    if (guard->begun && (guard->missed < limits->hold_samples)) {
      guard->missed++;
      status = CONTROLLER_STATUS_HELD;
    } else {
      set_zero(&guard->last);
      status = CONTROLLER_STATUS_ZERO;
    }
    *out = guard->last;
  }
  return status;
}

@ESTIMATOR@@HEAD@
{
  controller_input checked = *in;
  controller_state after = guard->state;
  uint32_t status = judged(in, valid, limits) | counted(in, guard);
  const bool repeated = (status & CONTROLLER_STATUS_REPEATED) != 0u;
  bool steps = !repeated && ((status & (@VITAL@)) == 0u);

@SUBSTITUTE@  if (!guard->begun && steps) {
    @BEGIN@
  }
  if (steps) {
    controller_step(p, &checked, &after, out);
    steps = is_usable_output(out) && is_usable_state(&after);
    status |= steps ? 0u : CONTROLLER_STATUS_REJECTED;
  }
@COAST@  return status | finished(limits, steps, &after, guard, out);
}
