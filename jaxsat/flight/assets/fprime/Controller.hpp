#ifndef CONTROL_CONTROLLER_HPP
#define CONTROL_CONTROLLER_HPP

#include "ControllerComponentAc.hpp"

#include <cstdint>

extern "C" {
#include "../../../controller_guard.h"
#include "../../../controller_parameters.h"
}

namespace Control {

//! Runs the controller behind its guard: measurements come first, then schedIn makes a step.
class Controller final : public ControllerComponentBase {
    friend class ControllerTester;  //!< of unit tests

  public:
    explicit Controller(const char* const compName);

  private:
    void measurementIn_handler(FwIndexType portNum,
@ARGUMENTS@) override;
    void schedIn_handler(FwIndexType portNum, U32 context) override;
    void Restart_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) override;
    void ResetCounters_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) override;

    //! The controller begins at the next step whose measurements are valid.
    void begin();

    //! Takes over parameters that have changed, if they are within their ranges.
    void readParameters();

    //! Tells what has changed since the last step, in events and channels.
    void tell(U32 status, I32 mode);

    controller_guard m_guard{};
    controller_input m_input{};  //!< the newest measurements
    controller_validity m_valid{};
    controller_parameters m_parameters{};  //!< those in use
    controller_guard_parameters m_limits{};
    controller_parameters m_readParameters{};  //!< those that were read last
    controller_guard_parameters m_readLimits{};
    U32 m_checksum = CONTROLLER_DEFAULT_CHECKSUM;
    U32 m_number = 0;            //!< of the next sample; may wrap around
    bool m_hasMeasured = false;  //!< whether measurements have come since the last step
    U32 m_status = 0;
    U32 m_statusSeen = 0;
    I32 m_mode = 0;
    U32 m_missingMeasurements = 0;
};

}  // namespace Control

#endif
