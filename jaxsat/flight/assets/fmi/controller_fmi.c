/* The controller behind its guard as an FMU for co-simulation (FMI 3.0). The types and functions are
   those of the standard, of which this file needs no header. */
#include "controller_guard.h"
#include "controller_parameters.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define FMI __declspec(dllexport)
#else
#define FMI __attribute__((visibility("default")))
#endif

#define PERIOD @PERIOD@
#define TOKEN "@TOKEN@"

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef uint32_t fmi3ValueReference;
typedef void (*fmi3LogMessageCallback)(void *, fmi3Status, const char *, const char *);
typedef void (*fmi3IntermediateUpdateCallback)(void *, double, bool, bool, bool, bool, bool,
                                               bool *, double *);

typedef struct {
  controller_parameters parameters;
  controller_guard_parameters limits;
  controller_input input;
  controller_validity valid;
  controller_guard guard;
  controller_output output;
  uint32_t status;
  int32_t sample; /* of the last step */
  double time;
  double begin; /* time of the first sample */
  uint32_t samples; /* that were made */
  bool is_running;
  bool is_changed; /* whether parameters were set since they were checked */
  void *environment;
  fmi3LogMessageCallback log;
} instance;

typedef enum { FLOAT32, FLOAT64, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOLEAN } kind;
typedef enum { READ, INPUT, PARAMETER } access;

/* The variables in the order of their value references. */
static const struct {
  size_t offset;
  kind type;
  access use;
} variables[] = {
@VARIABLES@
};

#define VARIABLES (sizeof(variables) / sizeof(variables[0]))

static fmi3Status refused(const instance *one, const char *reason)
{
  if (one->log != NULL) {
    one->log(one->environment, fmi3Error, "logStatusError", reason);
  }
  return fmi3Error;
}

static void reset(instance *one)
{
@BEGIN@  one->parameters = controller_default_parameters;
  one->limits = controller_default_guard_parameters;
  (void)memset(&one->input, 0, sizeof(one->input));
  (void)memset(&one->output, 0, sizeof(one->output));
@START@
  one->status = 0u;
  one->sample = 0;
  one->samples = 0u;
  one->time = 0.0;
  one->begin = 0.0;
  one->is_running = false;
  one->is_changed = true;
  controller_guard_init(@ATTITUDE@&one->guard);
}

static fmi3Status checked(instance *one)
{
  const controller_guard_parameters *limits = &one->limits;

  if (controller_check_parameters(&one->parameters) != 0) {
    return refused(one, "a parameter is out of its range");
  }
  if (!((limits->hold_samples >= 0) && (limits->rate_limit >= 0) && (limits->norm_tolerance >= 0))) {
    return refused(one, "a limit of the guard is negative");
  }
  one->is_changed = false;
  return fmi3OK;
}

/* Copies variables of one type to or from an array. */
static fmi3Status copied(instance *one, const fmi3ValueReference references[], size_t count,
                         kind type, size_t size, void *to, const void *from, size_t room)
{
  for (size_t i = 0u; i < count; i++) {
    const fmi3ValueReference number = references[i];
    if ((number >= VARIABLES) || (variables[number].type != type) || (i >= room)) {
      return refused(one, "no variable has this value reference and type");
    }
    if ((from != NULL) && (variables[number].use == READ)) {
      return refused(one, "only inputs and parameters can be set");
    }
    unsigned char *place = (unsigned char *)one + variables[number].offset;
    if (from == NULL) {
      (void)memcpy((unsigned char *)to + (i * size), place, size);
    } else {
      (void)memcpy(place, (const unsigned char *)from + (i * size), size);
      one->is_changed = one->is_changed || (variables[number].use == PARAMETER);
    }
  }
  return fmi3OK;
}

#define ACCESS(name, type, kind)                                                                   \
  FMI fmi3Status fmi3Get##name(void *, const fmi3ValueReference[], size_t, type[], size_t);        \
  FMI fmi3Status fmi3Get##name(void *one, const fmi3ValueReference references[], size_t count,     \
                               type values[], size_t room)                                         \
  {                                                                                                \
    return copied((instance *)one, references, count, kind, sizeof(type), values, NULL, room);     \
  }                                                                                                \
  FMI fmi3Status fmi3Set##name(void *, const fmi3ValueReference[], size_t, const type[], size_t);  \
  FMI fmi3Status fmi3Set##name(void *one, const fmi3ValueReference references[], size_t count,     \
                               const type values[], size_t room)                                   \
  {                                                                                                \
    return copied((instance *)one, references, count, kind, sizeof(type), NULL, values, room);     \
  }

ACCESS(Float32, float, FLOAT32)
ACCESS(Float64, double, FLOAT64)
ACCESS(Int8, int8_t, INT8)
ACCESS(UInt8, uint8_t, UINT8)
ACCESS(Int16, int16_t, INT16)
ACCESS(UInt16, uint16_t, UINT16)
ACCESS(Int32, int32_t, INT32)
ACCESS(UInt32, uint32_t, UINT32)
ACCESS(Int64, int64_t, INT64)
ACCESS(UInt64, uint64_t, UINT64)
ACCESS(Boolean, bool, BOOLEAN)

FMI const char *fmi3GetVersion(void);
FMI const char *fmi3GetVersion(void)
{
  return "3.0";
}

FMI void *fmi3InstantiateCoSimulation(const char *, const char *, const char *, bool, bool, bool, bool,
                                      const fmi3ValueReference[], size_t, void *,
                                      fmi3LogMessageCallback, fmi3IntermediateUpdateCallback);
FMI void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources,
                                      bool visible, bool logging, bool events, bool early,
                                      const fmi3ValueReference intermediate[], size_t count,
                                      void *environment, fmi3LogMessageCallback log,
                                      fmi3IntermediateUpdateCallback update)
{
  instance *one = NULL;

  if ((token != NULL) && (strcmp(token, TOKEN) == 0)) {
    one = (instance *)calloc(1u, sizeof(instance));
  }
  if (one != NULL) {
    one->environment = environment;
    one->log = log;
    reset(one);
  }
  return one;
}

FMI void fmi3FreeInstance(void *);
FMI void fmi3FreeInstance(void *one)
{
  free(one);
}

FMI fmi3Status fmi3SetDebugLogging(void *, bool, size_t, const char *const[]);
FMI fmi3Status fmi3SetDebugLogging(void *one, bool on, size_t count, const char *const categories[])
{
  return fmi3OK;
}

FMI fmi3Status fmi3EnterInitializationMode(void *, bool, double, double, bool, double);
FMI fmi3Status fmi3EnterInitializationMode(void *one, bool has_tolerance, double tolerance,
                                           double begin, bool has_end, double end)
{
  ((instance *)one)->begin = begin;
  ((instance *)one)->time = begin;
  return fmi3OK;
}

FMI fmi3Status fmi3ExitInitializationMode(void *);
FMI fmi3Status fmi3ExitInitializationMode(void *one)
{
  ((instance *)one)->is_running = true;
  return checked((instance *)one);
}

/* Makes the samples from a time to before the end of a step; inputs are held. */
FMI fmi3Status fmi3DoStep(void *, double, double, bool, bool *, bool *, bool *, double *);
FMI fmi3Status fmi3DoStep(void *pointer, double time, double step, bool no_return, bool *event,
                          bool *end, bool *early, double *last)
{
  instance *one = (instance *)pointer;
  const double until = time + step - (1e-6 * PERIOD);

  *event = false;
  *end = false;
  *early = false;
  *last = time;
  if (!one->is_running || !(step >= 0.0)) {
    return refused(one, "a step must follow the initialization, and not go back in time");
  }
  if (one->is_changed && (checked(one) != fmi3OK)) {
    return fmi3Error;
  }
  while ((one->begin + ((double)one->samples * PERIOD)) < until) {
    one->sample = (int32_t)(one->samples & 0x7FFFFFFFu);
    one->input.sample = one->sample;
    one->status = controller_guard_step(&one->parameters, &one->limits, &one->input, &one->valid,
                                        &one->guard, &one->output);
    one->samples++;
  }
  one->time = time + step;
  *last = one->time;
  return fmi3OK;
}

FMI fmi3Status fmi3Terminate(void *);
FMI fmi3Status fmi3Terminate(void *one)
{
  ((instance *)one)->is_running = false;
  return fmi3OK;
}

FMI fmi3Status fmi3Reset(void *);
FMI fmi3Status fmi3Reset(void *one)
{
  reset((instance *)one);
  return fmi3OK;
}

/* What this FMU does not do. Importers look for every function of the standard. */
#define UNSUPPORTED(name, ...)                                                                     \
  FMI fmi3Status fmi3##name(__VA_ARGS__);                                                          \
  FMI fmi3Status fmi3##name(__VA_ARGS__)                                                           \
  {                                                                                                \
    return fmi3Error;                                                                              \
  }

#define REFERENCES void *one, const fmi3ValueReference a[], size_t b

UNSUPPORTED(GetString, REFERENCES, const char *c[], size_t d)
UNSUPPORTED(SetString, REFERENCES, const char *const c[], size_t d)
UNSUPPORTED(GetBinary, REFERENCES, size_t c[], const uint8_t *d[], size_t e)
UNSUPPORTED(SetBinary, REFERENCES, const size_t c[], const uint8_t *const d[], size_t e)
UNSUPPORTED(GetClock, REFERENCES, bool c[])
UNSUPPORTED(SetClock, REFERENCES, const bool c[])
UNSUPPORTED(GetNumberOfVariableDependencies, void *one, fmi3ValueReference a, size_t *b)
UNSUPPORTED(GetVariableDependencies, void *one, fmi3ValueReference a, size_t b[],
            fmi3ValueReference c[], size_t d[], int e[], size_t f)
UNSUPPORTED(GetFMUState, void *one, void **a)
UNSUPPORTED(SetFMUState, void *one, void *a)
UNSUPPORTED(FreeFMUState, void *one, void **a)
UNSUPPORTED(SerializedFMUStateSize, void *one, void *a, size_t *b)
UNSUPPORTED(SerializeFMUState, void *one, void *a, uint8_t b[], size_t c)
UNSUPPORTED(DeserializeFMUState, void *one, const uint8_t a[], size_t b, void **c)
UNSUPPORTED(GetDirectionalDerivative, REFERENCES, const fmi3ValueReference c[], size_t d,
            const double e[], size_t f, double g[], size_t h)
UNSUPPORTED(GetAdjointDerivative, REFERENCES, const fmi3ValueReference c[], size_t d,
            const double e[], size_t f, double g[], size_t h)
UNSUPPORTED(EnterConfigurationMode, void *one)
UNSUPPORTED(ExitConfigurationMode, void *one)
UNSUPPORTED(EnterEventMode, void *one)
UNSUPPORTED(EnterStepMode, void *one)
UNSUPPORTED(EvaluateDiscreteStates, void *one)
UNSUPPORTED(UpdateDiscreteStates, void *one, bool *a, bool *b, bool *c, bool *d, bool *e, double *f)
UNSUPPORTED(GetIntervalDecimal, REFERENCES, double c[], int d[])
UNSUPPORTED(GetIntervalFraction, REFERENCES, uint64_t c[], uint64_t d[], int e[])
UNSUPPORTED(GetShiftDecimal, REFERENCES, double c[])
UNSUPPORTED(GetShiftFraction, REFERENCES, uint64_t c[], uint64_t d[])
UNSUPPORTED(SetIntervalDecimal, REFERENCES, const double c[])
UNSUPPORTED(SetIntervalFraction, REFERENCES, const uint64_t c[], const uint64_t d[])
UNSUPPORTED(SetShiftDecimal, REFERENCES, const double c[])
UNSUPPORTED(SetShiftFraction, REFERENCES, const uint64_t c[], const uint64_t d[])
UNSUPPORTED(GetOutputDerivatives, REFERENCES, const int32_t c[], double d[], size_t e)
UNSUPPORTED(ActivateModelPartition, void *one, fmi3ValueReference a, double b)
UNSUPPORTED(EnterContinuousTimeMode, void *one)
UNSUPPORTED(CompletedIntegratorStep, void *one, bool a, bool *b, bool *c)
UNSUPPORTED(SetTime, void *one, double a)
UNSUPPORTED(SetContinuousStates, void *one, const double a[], size_t b)
UNSUPPORTED(GetContinuousStates, void *one, double a[], size_t b)
UNSUPPORTED(GetContinuousStateDerivatives, void *one, double a[], size_t b)
UNSUPPORTED(GetNominalsOfContinuousStates, void *one, double a[], size_t b)
UNSUPPORTED(GetEventIndicators, void *one, double a[], size_t b)
UNSUPPORTED(GetNumberOfContinuousStates, void *one, size_t *a)
UNSUPPORTED(GetNumberOfEventIndicators, void *one, size_t *a)

FMI void *fmi3InstantiateModelExchange(const char *, const char *, const char *, bool, bool, void *,
                                       fmi3LogMessageCallback);
FMI void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources,
                                       bool visible, bool logging, void *environment,
                                       fmi3LogMessageCallback log)
{
  return NULL;
}

typedef void (*fmi3ClockUpdateCallback)(void *);
typedef void (*fmi3LockPreemptionCallback)(void);

FMI void *fmi3InstantiateScheduledExecution(const char *, const char *, const char *, bool, bool, void *,
                                            fmi3LogMessageCallback, fmi3ClockUpdateCallback,
                                            fmi3LockPreemptionCallback, fmi3LockPreemptionCallback);
FMI void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources,
                                            bool visible, bool logging, void *environment,
                                            fmi3LogMessageCallback log,
                                            fmi3ClockUpdateCallback update,
                                            fmi3LockPreemptionCallback lock,
                                            fmi3LockPreemptionCallback unlock)
{
  return NULL;
}
