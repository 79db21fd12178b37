// Runs the component on a stub of its base class: samples of a file, then what else may come. A
// sample is an input and a state, then the output and the next state that are expected.
#include "Controller.hpp"

#include <cstring>

extern "C" {
#include "controller_records.h"
}

namespace Control {

class ControllerTester {
  public:
    static constexpr int GIVEN = CONTROLLER_INPUT_SIZE + CONTROLLER_STATE_SIZE;
    static constexpr int EXPECTED = CONTROLLER_OUTPUT_SIZE + CONTROLLER_STATE_SIZE;

    void sample() {
        controller_input in;
        controller_output out;
        F64x4 attitude;
        F64x3 rate;
        const controller_validity valid = {true, (samples % 5) != 4};

        read_controller_input(row, &in);
        read_controller_state(row + CONTROLLER_INPUT_SIZE, &component.m_guard.state);
        component.m_guard.called = true;
        component.m_guard.begun = true;
        component.m_guard.missed = 0;
        component.m_guard.sample = static_cast<I32>(static_cast<U32>(in.sample) - 1);
        component.m_number = static_cast<U32>(in.sample);
        controller_guard guard = component.m_guard;
        for (U32 i = 0; i < 4; i++) {
            attitude[i] = in.attitude_q[i];
        }
        for (U32 i = 0; i < 3; i++) {
            rate[i] = in.omega[i];
        }
        component.measurementIn_handler(0, attitude, rate, valid.attitude, valid.omega);
        component.schedIn_handler(0, 0);
        const U32 status = controller_guard_step(
            &controller_default_parameters, &controller_default_guard_parameters, &in, &valid, &guard, &out);
        if (status == 0) {
            judged++;
        } else {
            write_controller_output(&out, row + GIVEN);
            write_controller_state(&guard.state, row + GIVEN + CONTROLLER_OUTPUT_SIZE);
        }
        double found[EXPECTED];
        out = controller_output();
        for (U32 i = 0; i < 2; i++) {
            out.torque[i] = component.torque[i];
            out.thrust[i] = component.thrust[i];
        }
        out.mode = component.mode;
        write_controller_output(&out, found);
        write_controller_state(&component.m_guard.state, found + CONTROLLER_OUTPUT_SIZE);
        differing += (component.status != status) || (component.sample != in.sample) ||
                     (component.channels[0] != status) ||
                     (std::memcmp(found, row + GIVEN, sizeof(found)) != 0);
        samples++;
    }

    void step() {
        component.schedIn_handler(0, 0);
        std::printf("step %d 0x%X missing %u\n", component.sample, component.status, component.channels[4]);
    }

    void others() {
        component.prints = true;
        step();  // without measurements
        component.loaded.e = Fw::ParamValid::DEFAULT;
        component.gain[0] = 3.0;
        component.gain[1] = 2.0;
        step();  // with the same parameters
        component.gain[1] = -1.0;
        step();
        component.hold = -1;
        component.gain[1] = 2.5;
        step();
        component.hold = 10;
        step();
        component.Restart_cmdHandler(0x20, 5);
        component.ResetCounters_cmdHandler(0x21, 6);
        step();
        std::printf("checksum 0x%X\n", component.channels[7]);
    }

    Controller component{"controller"};
    double row[GIVEN + EXPECTED];
    long samples = 0;
    long judged = 0;
    long differing = 0;
};

}  // namespace Control

int main(int count, char** words) {
    static Control::ControllerTester tester;
    std::FILE* file = (count == 2) ? std::fopen(words[1], "rb") : nullptr;
    if (file == nullptr) {
        return 2;
    }
    while (std::fread(tester.row, sizeof(tester.row), 1, file) == 1) {
        tester.sample();
    }
    std::printf("samples %ld, judged %ld, differing %ld, outputs %u\n", tester.samples, tester.judged,
                tester.differing, tester.component.outputs);
    tester.others();
    return std::fclose(file);
}
