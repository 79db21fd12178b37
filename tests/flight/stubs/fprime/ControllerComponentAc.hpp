// Stands for ControllerComponentAc.hpp, which F´'s fpp-to-cpp 3 makes of Controller.fpp for the law
// Filtered, and for what it includes of F´ 4: names and signatures are theirs. Events are printed.
#ifndef STUB_CONTROLLER_COMPONENT_AC_HPP
#define STUB_CONTROLLER_COMPONENT_AC_HPP

#include <cstdint>
#include <cstdio>

typedef bool BOOL;
typedef uint8_t U8;
typedef int16_t I16;
typedef int32_t I32;
typedef uint32_t U32;
typedef int64_t I64;
typedef double F64;
typedef I16 FwIndexType;
typedef U32 FwOpcodeType;

namespace Fw {
struct ParamValid {
    enum T { UNINIT = 0, VALID = 1, INVALID = 2, DEFAULT = 3 };
    T e = UNINIT;
    bool operator==(T other) const { return e == other; }
};
struct CmdResponse {
    enum T { OK = 0 };
    T e;
    CmdResponse(T e1) : e(e1) {}
};
}  // namespace Fw

namespace Control {

template <U32 N>
class Array {
  public:
    enum { SIZE = N };
    F64& operator[](const U32 i) { return this->elements[i]; }
    const F64& operator[](const U32 i) const { return this->elements[i]; }

  private:
    F64 elements[N] = {};
};
typedef Array<2> F64x2;
typedef Array<3> F64x3;
typedef Array<4> F64x4;

//! What a tester sees: parameters, which it may set, and what the component has sent.
class Seen {
  public:
    Fw::ParamValid loaded;
    F64x2 gain;
    I32 hold = 10;
    mutable F64x2 torque;
    mutable I32 mode = -1;
    mutable F64x2 thrust;
    mutable U32 status = 0;
    mutable I32 sample = 0;
    mutable U32 outputs = 0;
    U32 changes = 0;  //!< of the mode
    bool prints = false;
    U32 channels[8] = {};
};

class ControllerComponentBase : public Seen {
  protected:
    explicit ControllerComponentBase(const char* compName) { (void)compName; }
    virtual ~ControllerComponentBase() = default;

    virtual void measurementIn_handler(FwIndexType portNum, const F64x4& attitude_q,
                                       const F64x3& omega, bool valid_attitude,
                                       bool valid_omega) = 0;
    virtual void schedIn_handler(FwIndexType portNum, U32 context) = 0;
    virtual void Restart_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) = 0;
    virtual void ResetCounters_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) = 0;

    bool isConnected_outputOut_OutputPort(FwIndexType portNum) const { return portNum == 0; }
    void outputOut_out(FwIndexType portNum, const F64x2& torque1, const F64x2& thrust1, I32 mode1,
                       U32 status1, I32 sample1) const {
        torque = torque1;
        mode = mode1;
        thrust = thrust1;
        status = status1;
        sample = sample1;
        outputs += portNum == 0;
    }
    void cmdResponse_out(FwOpcodeType opCode, U32 cmdSeq, Fw::CmdResponse response) {
        std::printf("response %u %u %d\n", opCode, cmdSeq, response.e);
    }

    F64x2 paramGet_law_gain(Fw::ParamValid& valid) {
        valid = loaded;
        return gain;
    }
    I32 paramGet_guard_hold_samples(Fw::ParamValid& valid) {
        valid = loaded;
        return hold;
    }
    F64 paramGet_guard_rate_limit(Fw::ParamValid& valid) {
        valid = loaded;
        return 100.0;
    }
    F64 paramGet_guard_norm_tolerance(Fw::ParamValid& valid) {
        valid = loaded;
        return 0.001;
    }

    void log_ACTIVITY_HI_StatusCleared(U32 before) { print("cleared", 0, before); }
    void log_WARNING_LO_StatusChanged(U32 status1, U32 before) { print("status", status1, before); }
    void log_ACTIVITY_HI_ModeChanged(I32 mode1, I32 before) { changes += mode1 != before; }
    void log_ACTIVITY_HI_ParametersInUse(U32 checksum) { print("in use", checksum, 0); }
    void log_WARNING_HI_ParametersRefused(I32 number) { print("refused", static_cast<U32>(number), 0); }
    void log_ACTIVITY_HI_Restarted() { print("restarted", 0, 0); }

    void tlmWrite_Status(U32 arg) { channels[0] = arg; }
    void tlmWrite_StatusSeen(U32 arg) { channels[1] = arg; }
    void tlmWrite_Mode(I32 arg) { channels[2] = static_cast<U32>(arg); }
    void tlmWrite_Steps(U32 arg) { channels[3] = arg; }
    void tlmWrite_MissingMeasurements(U32 arg) { channels[4] = arg; }
    void tlmWrite_WithoutStep(U32 arg) { channels[5] = arg; }
    void tlmWrite_Missed(I32 arg) { channels[6] = static_cast<U32>(arg); }
    void tlmWrite_ParameterChecksum(U32 arg) { channels[7] = arg; }

  private:
    void print(const char* name, U32 first, U32 second) const {
        if (prints) {
            std::printf("%s 0x%X 0x%X\n", name, first, second);
        }
    }
};

}  // namespace Control

#endif
