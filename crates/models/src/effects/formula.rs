//! Formulas of effects that are defined in files. A formula has numbers, one state, parameters, + − * / ^ and a few functions. It is
//! evaluated together with its derivative.

use base::number::{Dual, Scalar};

/// Parsed formula of one state variable and of parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    root: Node,
}

#[derive(Debug, Clone, PartialEq)]
enum Node {
    Number(f64),
    State,
    /// Parameter with this index.
    Parameter(usize),
    Negative(Box<Node>),
    Binary(Operator, Box<[Node; 2]>),
    Call(Function, Vec<Node>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Function {
    Exp,
    Log,
    Sqrt,
    Tanh,
    Abs,
    Min,
    Max,
}

const FUNCTIONS: [(&str, Function, usize); 7] = [
    ("exp", Function::Exp, 1),
    ("log", Function::Log, 1),
    ("sqrt", Function::Sqrt, 1),
    ("tanh", Function::Tanh, 1),
    ("abs", Function::Abs, 1),
    ("min", Function::Min, 2),
    ("max", Function::Max, 2),
];

/// Largest number of numbers, names, operations and functions in a formula.
const MOST_NODES: usize = 500;
/// Largest depth of nested parentheses or signs in a formula.
const DEEPEST: usize = 60;

/// Mistake in a formula, with its place and a remedy.
#[derive(Debug, Clone, PartialEq)]
pub struct FormulaError {
    /// Column of the mistake in the formula, counted from 1.
    pub column: usize,
    /// Description of the mistake.
    pub found: String,
    /// What the user can do.
    pub remedy: String,
}

impl Formula {
    /// Reads a formula. `state` is the name of the state, `parameters` are the names of the parameters.
    ///
    /// # Errors
    /// [`FormulaError`] for the first mistake in the text.
    pub fn parse(text: &str, state: &str, parameters: &[&str]) -> Result<Self, FormulaError> {
        let mut parser = Parser { text, at: 0, state, parameters, n_nodes: 0, depth: 0 };
        let root = parser.sum()?;
        parser.blank();
        match parser.rest().chars().next() {
            None => Ok(Self { root }),
            Some(c) => Err(parser.mistake(
                format!("`{c}` cannot continue the formula here"),
                "write numbers, names, + - * / ^ and parentheses",
            )),
        }
    }

    /// Returns `true` if the state occurs in the formula.
    pub fn has_state(&self) -> bool {
        self.root.any(&|node| *node == Node::State)
    }

    /// Returns `true` if the parameter at this index occurs in the formula.
    pub fn has_parameter(&self, place: usize) -> bool {
        self.root.any(&|node| *node == Node::Parameter(place))
    }

    /// Returns the value of the formula, with its derivative in the direction of the derivatives of `state` and `parameters`.
    pub fn value(&self, state: Dual, parameters: &[Dual]) -> Dual {
        self.root.value(state, parameters)
    }
}

impl Node {
    fn any(&self, is_it: &dyn Fn(&Self) -> bool) -> bool {
        is_it(self)
            || match self {
                Self::Negative(inner) => inner.any(is_it),
                Self::Binary(_, pair) => pair.iter().any(|part| part.any(is_it)),
                Self::Call(_, parts) => parts.iter().any(|part| part.any(is_it)),
                Self::Number(_) | Self::State | Self::Parameter(_) => false,
            }
    }

    fn value(&self, state: Dual, parameters: &[Dual]) -> Dual {
        match self {
            Self::Number(number) => Dual::constant(*number),
            Self::State => state,
            Self::Parameter(place) => parameters[*place],
            Self::Negative(inner) => -inner.value(state, parameters),
            Self::Binary(operator, pair) => {
                let [a, b] = [&pair[0], &pair[1]].map(|part| part.value(state, parameters));
                match operator {
                    Operator::Add => a + b,
                    Operator::Subtract => a - b,
                    Operator::Multiply => a * b,
                    Operator::Divide => a / b,
                    Operator::Power => power(a, b),
                }
            }
            Self::Call(function, parts) => {
                let of = |place: usize| parts[place].value(state, parameters);
                match function {
                    Function::Exp => of(0).exp(),
                    Function::Log => of(0).ln(),
                    Function::Sqrt => power(of(0), Dual::constant(0.5)),
                    Function::Tanh => {
                        let x = of(0);
                        let value = x.value.tanh();
                        Dual { value, derivative: (1.0 - value * value) * x.derivative }
                    }
                    Function::Abs => {
                        let x = of(0);
                        if x.value < 0.0 { -x } else { x }
                    }
                    Function::Min => {
                        let (a, b) = (of(0), of(1));
                        if b.value < a.value { b } else { a }
                    }
                    Function::Max => {
                        let (a, b) = (of(0), of(1));
                        if b.value > a.value { b } else { a }
                    }
                }
            }
        }
    }
}

/// Returns xʸ. For integer y the power exists for any x. For x = 0 and y > 0 it is 0.
fn power(x: Dual, y: Dual) -> Dual {
    if y.is_constant(2.0) {
        return x * x;
    }
    if x.value > 0.0 {
        return x.pow(y);
    }
    let value = x.value.powf(y.value);
    let by_base = y.value * x.value.powf(y.value - 1.0);
    // For x = 0 a positive power does not depend on the exponent. For x < 0 the exponent must be constant.
    let by_exponent = if y.derivative == 0.0 || x.value == 0.0 { 0.0 } else { f64::NAN };
    let of_base = if x.derivative == 0.0 { 0.0 } else { by_base * x.derivative };
    Dual { value, derivative: of_base + by_exponent }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    state: &'a str,
    parameters: &'a [&'a str],
    n_nodes: usize,
    depth: usize,
}

impl Parser<'_> {
    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn blank(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start().len();
    }

    fn mistake(&self, found: impl Into<String>, remedy: impl Into<String>) -> FormulaError {
        let column = 1 + self.text[..self.at].chars().count();
        FormulaError { column, found: found.into(), remedy: remedy.into() }
    }

    /// Consumes the next character if it is `sign`. Returns `true` if it was.
    fn take(&mut self, sign: char) -> bool {
        self.blank();
        let is_next = self.rest().starts_with(sign);
        if is_next {
            self.at += sign.len_utf8();
        }
        is_next
    }

    fn made(&mut self, node: Node) -> Result<Node, FormulaError> {
        self.n_nodes += 1;
        if self.n_nodes > MOST_NODES {
            return Err(self.mistake(
                format!("the formula has at least {} parts, which is too many", self.n_nodes),
                "write a shorter formula",
            ));
        }
        Ok(node)
    }

    fn binary(&mut self, operator: Operator, a: Node, b: Node) -> Result<Node, FormulaError> {
        self.made(Node::Binary(operator, Box::new([a, b])))
    }

    fn sum(&mut self) -> Result<Node, FormulaError> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.mistake("parentheses are nested too deeply", "write a simpler formula"));
        }
        let mut left = self.product()?;
        loop {
            let operator = if self.take('+') {
                Operator::Add
            } else if self.take('-') || self.take('−') {
                Operator::Subtract
            } else {
                self.depth -= 1;
                return Ok(left);
            };
            let right = self.product()?;
            left = self.binary(operator, left, right)?;
        }
    }

    fn product(&mut self) -> Result<Node, FormulaError> {
        let mut left = self.signed()?;
        loop {
            let operator = if self.take('*') || self.take('·') {
                Operator::Multiply
            } else if self.take('/') {
                Operator::Divide
            } else {
                return Ok(left);
            };
            let right = self.signed()?;
            left = self.binary(operator, left, right)?;
        }
    }

    /// Reads a factor with an optional sign. The sign applies to the whole power: −x^y is −(x^y).
    fn signed(&mut self) -> Result<Node, FormulaError> {
        if self.take('-') || self.take('−') {
            self.depth += 1;
            if self.depth > DEEPEST {
                return Err(self.mistake("too many signs follow each other", "write one sign"));
            }
            let inner = self.signed()?;
            self.depth -= 1;
            return self.made(Node::Negative(Box::new(inner)));
        }
        let base = self.atom()?;
        if self.take('^') {
            let exponent = self.signed()?;
            return self.binary(Operator::Power, base, exponent);
        }
        Ok(base)
    }

    fn atom(&mut self) -> Result<Node, FormulaError> {
        self.blank();
        let Some(first) = self.rest().chars().next() else {
            return Err(self.mistake("the formula is incomplete", "complete the formula"));
        };
        if self.take('(') {
            let inner = self.sum()?;
            return self.closed(inner);
        }
        if first.is_ascii_digit() || first == '.' {
            return self.number();
        }
        if !(first.is_ascii_alphabetic() || first == '_') {
            return Err(self.mistake(
                format!("`{first}` is neither a number nor a name"),
                "write a number, a name or parentheses",
            ));
        }
        let length = self.rest().find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(self.rest().len());
        let name = self.rest()[..length].to_string();
        if name == self.state {
            self.at += length;
            return self.made(Node::State);
        }
        if let Some(place) = self.parameters.iter().position(|parameter| *parameter == name) {
            self.at += length;
            return self.made(Node::Parameter(place));
        }
        let Some((_, function, n_arguments)) = FUNCTIONS.iter().find(|(function_name, ..)| *function_name == name)
        else {
            let functions: Vec<&str> = FUNCTIONS.iter().map(|(name, ..)| *name).collect();
            let known = [&[self.state], self.parameters, &functions].concat();
            let near = base::units::nearest_name(&name, known.iter().copied());
            let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
            return Err(self.mistake(
                format!("`{name}` is not known here"),
                format!(
                    "{hint}use the state `{}`, the parameters of the file, or {}",
                    self.state,
                    functions.join(", ")
                ),
            ));
        };
        self.at += length;
        if !self.take('(') {
            return Err(self.mistake(format!("`{name}` has no argument"), format!("write `{name}(…)`")));
        }
        let mut arguments = vec![self.sum()?];
        while self.take(',') {
            arguments.push(self.sum()?);
        }
        if arguments.len() != *n_arguments {
            let found = format!("`{name}` has {} arguments", arguments.len());
            return Err(self.mistake(found, format!("give it {n_arguments}")));
        }
        let call = self.made(Node::Call(*function, arguments))?;
        self.closed(call)
    }

    fn closed(&mut self, inner: Node) -> Result<Node, FormulaError> {
        if self.take(')') { Ok(inner) } else { Err(self.mistake("a parenthesis is not closed", "write `)` here")) }
    }

    fn number(&mut self) -> Result<Node, FormulaError> {
        let rest = self.rest();
        let digits = |from: usize| {
            rest[from..].find(|c: char| !(c.is_ascii_digit() || c == '.')).map_or(rest.len(), |n| from + n)
        };
        let mut end = digits(0);
        if rest[end..].starts_with(['e', 'E']) {
            let after_sign = end + 1 + usize::from(rest[end + 1..].starts_with(['+', '-']));
            if rest[after_sign..].starts_with(|c: char| c.is_ascii_digit()) {
                end = digits(after_sign);
            }
        }
        let text = rest[..end].to_string();
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => {
                self.at += end;
                self.made(Node::Number(number))
            }
            _ => Err(self.mistake(format!("`{text}` is not a number"), "write a number such as 0.5 or 2e3")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(text: &str, state: f64, parameters: &[f64]) -> f64 {
        let names = ["a", "s0"];
        let formula = Formula::parse(text, "path", &names[..parameters.len()]).expect("a formula");
        let constants: Vec<Dual> = parameters.iter().map(|p| Dual::constant(*p)).collect();
        formula.value(Dual::constant(state), &constants).value
    }

    /// Checks formulas against values that were computed by hand. They cover precedence, signs and powers.
    #[test]
    fn formulas_mean_what_they_say() {
        assert_eq!(at("1 + 2*path^2", 3.0, &[]), 19.0);
        assert_eq!(at("-path^2", 3.0, &[]), -9.0);
        assert_eq!(at("2^3^2", 0.0, &[]), 512.0);
        assert_eq!(at("8/4/2 - 1 - 1", 0.0, &[]), -1.0);
        assert_eq!(at("(1 + a)*(path - s0)", 5.0, &[2.0, 1.0]), 12.0);
        assert_eq!(at("max(0, path - 2)", 1.0, &[]), 0.0);
        assert_eq!(at("min(path, 2e0) + abs(-3)", 7.0, &[]), 5.0);
        assert!(
            (at("exp(-a*path) + log(2) + sqrt(9) + tanh(0.3)", 2.0, &[0.5])
                - ((-1.0_f64).exp() + 2_f64.ln() + 3.0 + 0.3_f64.tanh()))
            .abs()
                < 1e-15
        );
        assert_eq!(at("(path/s0)^2", -4.0, &[0.0, 2.0]), 4.0);
        assert_eq!(at("path^a", 0.0, &[0.5]), 0.0);
    }

    /// Checks derivatives by the state and by each parameter against central differences.
    #[test]
    fn derivatives_equal_differences() {
        let formula =
            Formula::parse("(1 + a*tanh(path/s0))^a * exp(-path) + max(path, s0)/sqrt(path)", "path", &["a", "s0"])
                .expect("a formula");
        let point = [0.7, 1.3, 0.4];
        for seed in 0..3 {
            let value =
                |x: [f64; 3]| formula.value(Dual::constant(x[0]), &[Dual::constant(x[1]), Dual::constant(x[2])]).value;
            let moved = |h: f64| {
                let mut x = point;
                x[seed] += h;
                value(x)
            };
            let number = |k: usize| Dual { value: point[k], derivative: f64::from(u8::from(k == seed)) };
            let found = formula.value(number(0), &[number(1), number(2)]).derivative;
            assert!((found - (moved(1e-6) - moved(-1e-6)) / 2e-6).abs() < 1e-8, "{seed}");
        }
    }

    #[test]
    fn mistakes_have_column_and_remedy() {
        let cases = [
            ("1 + pat", 5, "did you mean `path`"),
            ("exp path", 5, "exp(…)"),
            ("(1 + path", 10, "write `)`"),
            ("1 + ", 5, "complete the formula"),
            ("1 $ 2", 3, "write numbers"),
            ("min(1)", 6, "give it 2"),
            ("1..2", 1, "write a number"),
            ("system(1)", 1, "use the state"),
        ];
        for (text, column, remedy) in cases {
            let mistake = Formula::parse(text, "path", &[]).expect_err(text);
            assert!(mistake.column == column && mistake.remedy.contains(remedy), "{text}: {mistake:?}");
        }
        for (text, found) in [
            (format!("{}1{}", "(".repeat(5_000), ")".repeat(5_000)), "parentheses are nested too deeply"),
            ("-".repeat(5_000), "too many signs follow each other"),
            (["1"; 2_000].join("+"), "the formula has at least 501 parts, which is too many"),
        ] {
            let mistake = Formula::parse(&text, "path", &[]).expect_err(found);
            assert_eq!(mistake.found, found);
        }
    }
}
