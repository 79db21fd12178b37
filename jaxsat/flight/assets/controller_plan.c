static bool has_unit_quaternions(const controller_plan *plan)
{
  bool is_right = true;

  for (int32_t i = 0; i < @COUNT@; i++) {
    const @REAL@ *q = plan->attitude[i];
    const @REAL@ excess = (q[0] * q[0]) + (q[1] * q[1]) + (q[2] * q[2]) + (q[3] * q[3]) - 1;
    is_right = is_right && (excess <= @TOLERANCE@) && (excess >= -@TOLERANCE@);
  }
  return is_right;
}

int32_t controller_load_plan(const controller_plan *plan, uint32_t checksum,
                             controller_parameters *p)
{
  int32_t found = CONTROLLER_PLAN_LOADED;

  if (controller_plan_checksum(plan) != checksum) {
    found = CONTROLLER_PLAN_CHANGED;
  } else if (controller_check_plan(plan) != 0) {
    found = CONTROLLER_PLAN_OUT_OF_RANGE;
  } else if (!has_unit_quaternions(plan)) {
    found = CONTROLLER_PLAN_NOT_UNIT;
  } else {
@COPIES@
  }
  return found;
}
