"""Programs of scalars as statements of C; the turns of every loop have a known bound."""

import re
from collections.abc import Sequence

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.c.arrays import Arrays
from jaxsat.compiler.c.body import Body
from jaxsat.compiler.c.contexts import arrays_in, squeezed
from jaxsat.compiler.c.expressions import BOTH, UNARY, Expression, called, infix, operation
from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.unit import POINTERS, AbstractUnit, Record
from jaxsat.compiler.lowering import CannotLower
from jaxsat.compiler.passes.counting import CountedLoop, bound_of


class Printer:
    """Printer of the statements of one C function into `body`."""

    def __init__(self, unit: AbstractUnit, body: Body):
        self._unit, self.body = unit, body
        self._trace, self._uses = body.trace, body.uses
        self._arrays = Arrays(unit, body)
        self._pointers: set[str] = set()

    def pointers(self, lines: Sequence[str]) -> set[str]:
        """Return the structures that these lines of the function need."""
        text = "\n".join(lines)
        uses = {one for one in POINTERS if re.search(rf"(?<![\w>.]){one}(->|\[)", text)}
        return uses | self._pointers

    def block(self, block: ir.Block) -> None:
        """Print the statements of a block."""
        for step in block.steps:
            self._step(step)

    def _step(self, step: ir.Step) -> None:
        match step:
            case ir.Operation():
                args = self.body.operands(step.args)
                kinds = [x.dtype for x in step.args]
                need = self._unit.need
                self.body.keep(step.out, operation(step.name, args, kinds, step.out.dtype, need))
            case ir.Load():
                index = self.body.operand(step.index)
                place = self._arrays.element(step.memory, index.text)
                self.body.name(step.out, Expression(place))
            case ir.Store():
                index, value = self.body.operand(step.index), self.body.operand(step.value)
                memory = self._arrays.memory(step.memory)
                self.body.line(f"{memory}[{index.text}] = {value.text};")
            case ir.BlockSwitch():
                self._switch(step)
            case ir.Loop():
                self._loop(step)
            case ir.Call(function=ir.Function(source=None)):
                self._elementary_call(step)
            case ir.Call(function=ir.Function(source=source)):
                assert source is not None
                self._python_call(step, source)

    def _elementary_call(self, step: ir.Call) -> None:
        args = self.body.operands(step.args)
        name = self._unit.elementary(step.function, self._trace)
        if len(step.outs) == 1:
            self.body.keep(step.outs[0], called(name, *args))
            return
        pointers = [Expression(f"&{self.body.place(out)}") for out in step.outs]
        self.body.line(f"{called(name, *args, *pointers).text};")

    def _python_call(self, step: ir.Call, source: ir.Source) -> None:
        printed = self._unit.python(step.function, self._trace)
        self._pointers.update(printed.pointers)
        args = [Expression(text) for text in (*printed.pointers, *printed.counts)]
        arrays = arrays_in(step.args, source.params)
        for array, shape, passed in zip(arrays, source.params, printed.passed, strict=True):
            if passed:
                args.append(self._arrays.argument(array, squeezed(shape)))
        count = len(args)
        record = self.body.names.new("found") if printed.outputs is not None else ""
        fields = iter(() if printed.outputs is None else printed.outputs.fields)
        if printed.outputs is not None:
            self.body.line(f"{printed.outputs.kind} {record};")
            args.append(Expression(f"&{record}"))
        result, after = None, []
        outs = arrays_in(step.outs, source.results)
        for array, shape, way in zip(outs, source.results, printed.results, strict=True):
            if way == "value":
                result = array[0]
            elif way == "pointer" and record:
                self._arrays.found(array, squeezed(shape), f"{record}.{next(fields)}", after)
            elif way == "pointer":
                args.append(self._arrays.receiver(array, squeezed(shape), after))
            else:
                for out in array:
                    self.body.expressions[out.number] = Expression(self.body.places[out.number])
        if printed.arguments is not None:
            first = len(printed.pointers)
            args[first:count] = [self._in_record(printed.arguments, args[first:count])]
        call = called(printed.name, *args)
        is_kept = printed.arguments is None and "field" not in printed.results
        if result is not None and is_kept:
            self.body.keep(result, call)
        elif result is not None:
            self.body.name(result, call)
        else:
            self.body.wrapped(f"{call.text};")
        for place, text in after:
            self.body.line(f"{place} = {text};")

    def _in_record(self, record: Record, args: Sequence[Expression]) -> Expression:
        """Return the address of a new record of arguments."""
        name = self.body.names.new("given")
        fields = zip(record.fields, args, strict=True)
        texts = [f".{field} = {argument.text}" for field, argument in fields]
        self.body.wrapped(f"const {record.kind} {name} = {{{', '.join(texts)}}};")
        return Expression(f"&{name}")

    def _switch(self, step: ir.BlockSwitch) -> None:
        body = self.body
        self._arrays.declare(step.blocks)
        condition = self._condition(step.index) if len(step.blocks) == 2 else None
        index = body.operand(step.index) if condition is None else None
        if step.outs:
            body.tell(step.outs[0])
        places = [body.place(out) for out in step.outs]
        if len(step.blocks) == 2:
            if condition is None:
                assert index is not None
                condition = f"{index.inside(UNARY)} != {step.names.get(0, 0)}"
            body.line(f"if ({condition}) {{")
            self._branch(step, 1, places)
            body.line("} else {")
            self._branch(step, 0, places)
            body.line("}")
            return
        assert index is not None
        body.line(f"switch ({index.text}) {{")
        for number in range(len(step.blocks)):
            last = number == len(step.blocks) - 1
            body.line("default: {" if last else f"case {step.names.get(number, number)}: {{")
            self._branch(step, number, places)
            body.line("  break;")
            body.line("}")
        body.line("}")

    def _branch(self, step: ir.BlockSwitch, number: int, places: Sequence[str]) -> None:
        with self.body.inside():
            self.block(step.blocks[number])
            for place, result in zip(places, step.yields[number], strict=True):
                self.body.assign(place, self.body.operand(result))

    def _condition(self, index: ir.Scalar) -> str | None:
        """Return the bool by which a branch of two is chosen, behind its conversion to a number."""
        expressions = self.body.expressions
        while isinstance(index, ir.Value) and index.number in self._uses.makers:
            maker = self._uses.makers[index.number]
            values = [x for x in maker.args if isinstance(x, ir.Value)]
            others = [x for x in maker.args if not isinstance(x, ir.Value)]
            if maker.name == "convert" and values and values[0].dtype == np.dtype(bool):
                return self._bool_of(index, values[0])
            within = {"max": lambda x: x <= 0, "min": lambda x: x >= 1}.get(maker.name)
            if within is None or len(others) != 1 or not within(int(others[0])):
                return None
            if self.body.is_pending(index) and values[0].number not in expressions:
                return None
            index = values[0]
        return None

    def _bool_of(self, number: ir.Value, flag: ir.Value) -> str | None:
        """Return the text of a bool whose conversion to a number is pending."""
        if not self.body.is_pending(number):
            return None
        text = self.body.operand(number).text
        if flag.number in self.body.expressions:
            return self.body.expressions[flag.number].text
        if not text.endswith(" ? 1 : 0"):
            return None
        text = text.removesuffix(" ? 1 : 0")
        return text[1:-1] if _is_enclosed(text) else text

    def _loop(self, step: ir.Loop) -> None:
        body = self.body
        bound = bound_of(step, self._uses.makers)
        if bound is None:
            frames = self._trace.places.get(step.params[0].number, ()) if step.params else ()
            where = f"{frames[-1].file}:{frames[-1].line} ({frames[-1].function})" if frames else ""
            what = "`while`: how often the loop turns is not known when the law is traced"
            raise CannotLower(f"{what}, so that flight code has no bound for it", where)
        self._arrays.declare((step.condition, step.body))
        body.tell(step.params[0])
        befores = [body.operand(x).text for x in step.before]
        for i, (param, before) in enumerate(zip(step.params, befores, strict=True)):
            if i != bound.counter:
                body.place(param, before)
        name = body.place(step.params[bound.counter], befores[bound.counter])
        turn = f"({name})++" if name.startswith("*") else f"{name}++"
        body.line(f"for (; {name} < {bound.end}; {turn}) {{")
        with body.inside():
            self._leave_early(step, bound)
            self.block(step.body)
            self._carry_over(step, bound.counter)
        body.line("}")

    def _leave_early(self, step: ir.Loop, bound: CountedLoop) -> None:
        """End a loop before its count is reached, where it has another condition too."""
        body = self.body
        joined: set[int] = set()
        others = self._conditions(step.active, joined)
        counters = [one for one in others if isinstance(one, ir.Value) and one.number == bound.test]
        if counters:  # the loop itself tests it
            joined.update([bound.test] if self._uses.is_once(counters[0]) else [])
            others = [one for one in others if one is not counters[0]]
        for one in step.condition.steps:
            if not (isinstance(one, ir.Operation) and one.out.number in joined):
                self._step(one)
        if not others:
            return
        condition = body.operand(others[0])
        for one in others[1:]:
            condition = infix("&&", BOTH, condition, body.operand(one))
        body.line(f"if (!{condition.inside(UNARY)}) {{")
        body.line("  break;")
        body.line("}")

    def _conditions(self, one: ir.Scalar, joined: set[int]) -> list[ir.Scalar]:
        """Return the conjuncts of a condition; `joined` gets numbers of conjunctions read once."""
        maker = self._uses.makers.get(one.number) if isinstance(one, ir.Value) else None
        if maker is None or maker.name != "and" or not self._uses.is_once(maker.out):
            return [one]
        joined.add(maker.out.number)
        return [part for arg in maker.args for part in self._conditions(arg, joined)]

    def _carry_over(self, step: ir.Loop, counter: int) -> None:
        """Assign the params of the next turn, all computed before the first assignment."""
        body = self.body
        moves = []
        params = {param.number for param in step.params}
        for i, (param, after) in enumerate(zip(step.params, step.after, strict=True)):
            if i == counter:
                body.drop(after)
            elif not isinstance(after, ir.Value):
                moves.append((param, body.operand(after).text))
            elif after.number == param.number:
                continue
            elif body.is_pending(after) or after.number in params:
                name = body.names.new("following")
                body.assign(f"const {TYPES[after.dtype]} {name}", body.operand(after))
                moves.append((param, name))
            else:
                moves.append((param, body.operand(after).text))
        for param, text in moves:
            body.line(f"{body.expressions[param.number].text} = {text};")


def _is_enclosed(text: str) -> bool:
    depth = 0
    for place, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return letter == ")" and place == len(text) - 1
    return False
