// A component for NASA's F´ 4 that runs the controller behind its guard.
#include "Controller.hpp"

#include <cstring>

namespace Control {

namespace {

// An array of FPP has the elements of a field in order, whatever dimensions the field has.
template <class Array, class Field>
void toField(const Array& from, Field& to) {
    static_assert(sizeof(Field) == Array::SIZE * sizeof(from[0]), "as many elements");
    for (U32 i = 0; i < static_cast<U32>(Array::SIZE); i++) {
        (void)std::memcpy(reinterpret_cast<U8*>(&to) + i * sizeof(from[0]), &from[i], sizeof(from[0]));
    }
}

template <class Array, class Field>
Array fromField(const Field& from) {
    Array to;
    static_assert(sizeof(Field) == Array::SIZE * sizeof(to[0]), "as many elements");
    for (U32 i = 0; i < static_cast<U32>(Array::SIZE); i++) {
        (void)std::memcpy(&to[i], reinterpret_cast<const U8*>(&from) + i * sizeof(to[0]), sizeof(to[0]));
    }
    return to;
}

// Whether a parameter is set: it is not before loadParameters.
bool isSet(const Fw::ParamValid& valid) {
    return (valid == Fw::ParamValid::VALID) || (valid == Fw::ParamValid::DEFAULT);
}

}  // namespace

Controller::Controller(const char* const compName)
    : ControllerComponentBase(compName),
      m_parameters(controller_default_parameters),
      m_limits(controller_default_guard_parameters) {
    // Copies of all bytes, because they are compared
    (void)std::memcpy(&this->m_readParameters, &this->m_parameters, sizeof(this->m_parameters));
    (void)std::memcpy(&this->m_readLimits, &this->m_limits, sizeof(this->m_limits));
    this->begin();
}

void Controller::begin() {
@BEGIN@    controller_guard_init(@ATTITUDE@&this->m_guard);
    this->m_number = 0;
    this->m_hasMeasured = false;
}

void Controller::measurementIn_handler(FwIndexType portNum,
@ARGUMENTS@) {
    (void)portNum;
@READ@
    this->m_hasMeasured = true;
}

// Makes a step. Without new measurements they are flagged as invalid, and the guard goes on.
void Controller::schedIn_handler(FwIndexType portNum, U32 context) {
    const controller_validity none{};
    controller_output output;

    (void)portNum;
    (void)context;
    this->readParameters();
    if (!this->m_hasMeasured) {
        this->m_missingMeasurements++;
    }
    this->m_input.sample = static_cast<I32>(this->m_number);
    const U32 status =
        controller_guard_step(&this->m_parameters, &this->m_limits, &this->m_input,
                              this->m_hasMeasured ? &this->m_valid : &none, &this->m_guard, &output);
    this->m_hasMeasured = false;
    this->m_number++;
    if (this->isConnected_outputOut_OutputPort(0)) {
        this->outputOut_out(0,
@WRITE@);
    }
    this->tell(status, static_cast<I32>(output.mode));
}

void Controller::readParameters() {
    controller_parameters read;
    controller_guard_parameters limits;
    Fw::ParamValid valid;

    (void)std::memcpy(&read, &this->m_readParameters, sizeof(read));
    (void)std::memcpy(&limits, &this->m_readLimits, sizeof(limits));
@TAKE@
    if ((std::memcmp(&read, &this->m_readParameters, sizeof(read)) == 0) &&
        (std::memcmp(&limits, &this->m_readLimits, sizeof(limits)) == 0)) {
        return;
    }
    (void)std::memcpy(&this->m_readParameters, &read, sizeof(read));
    (void)std::memcpy(&this->m_readLimits, &limits, sizeof(limits));
    const I32 wrong = controller_check_parameters(&read);
    if ((wrong != 0) ||
        !((limits.hold_samples >= 0) && (limits.rate_limit >= 0) && (limits.norm_tolerance >= 0))) {
        this->log_WARNING_HI_ParametersRefused(wrong);
        return;
    }
    this->m_parameters = read;
    this->m_limits = limits;
    this->m_checksum = controller_parameter_checksum(&read);
    this->log_ACTIVITY_HI_ParametersInUse(this->m_checksum);
}

void Controller::tell(U32 status, I32 mode) {
    if ((status != this->m_status) && (status == 0)) {
        this->log_ACTIVITY_HI_StatusCleared(this->m_status);
    } else if (status != this->m_status) {
        this->log_WARNING_LO_StatusChanged(status, this->m_status);
    }
    if (mode != this->m_mode) {
        this->log_ACTIVITY_HI_ModeChanged(mode, this->m_mode);
    }
    this->m_status = status;
    this->m_statusSeen |= status;
    this->m_mode = mode;
    this->tlmWrite_Status(status);
    this->tlmWrite_StatusSeen(this->m_statusSeen);
    this->tlmWrite_Mode(mode);
    this->tlmWrite_Steps(this->m_number);
    this->tlmWrite_MissingMeasurements(this->m_missingMeasurements);
    this->tlmWrite_WithoutStep(this->m_guard.without_step);
    this->tlmWrite_Missed(this->m_guard.missed);
    this->tlmWrite_ParameterChecksum(this->m_checksum);
}

void Controller::Restart_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) {
    this->begin();
    this->log_ACTIVITY_HI_Restarted();
    this->cmdResponse_out(opCode, cmdSeq, Fw::CmdResponse::OK);
}

void Controller::ResetCounters_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) {
    this->m_statusSeen = 0;
    this->m_missingMeasurements = 0;
    this->cmdResponse_out(opCode, cmdSeq, Fw::CmdResponse::OK);
}

}  // namespace Control
