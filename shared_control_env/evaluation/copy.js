document.querySelectorAll(".copy").forEach(button => button.addEventListener("click", async () => {
  const text = button.nextElementSibling.textContent;
  try { await navigator.clipboard.writeText(text); } catch (error) {
    getSelection().selectAllChildren(button.nextElementSibling); document.execCommand("copy");
  }
  button.textContent = "copied";
}));
