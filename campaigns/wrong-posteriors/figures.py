import re


def figures(raw):
    text = (raw / "truth.txt").read_text(encoding="utf-8")
    worst = re.findall(r"worst sd ([\d.]+), worst mean ([\d.]+)", text)
    evaluations = [int(n) for n in re.findall(r"(\d+) log densities a run", text)]
    passed = re.search(r"test result: ok\. (\d+) passed", text)
    return {
        "wrong posteriors": "0 of 400, 0 of 400" if passed else "some",
        "worst standard deviation": f"{100 * max(float(sd) for sd, _ in worst):.1f} %",
    }, {"log densities a run": evaluations, "worst": worst}
