void controller_@STAGE@_batch(int64_t count, const double *rows, double *found);
void controller_@STAGE@_batch(int64_t count, const double *rows, double *found)
{
  for (int64_t case_number = 0; case_number < count; case_number++) {
    controller_parameters parameters;
    controller_input input;
    controller_state before;
    controller_state after;
@VARIABLES@@READS@    after = before;
    @CALL@
    write_controller_@KIND@(&@RESULT@, found);
    write_controller_state(&after, found + @STATE@);
    rows += @ROW@;
    found += @NEXT@;
  }
}
